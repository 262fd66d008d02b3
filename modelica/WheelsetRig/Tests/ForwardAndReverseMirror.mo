within WheelsetRig.Tests;
model ForwardAndReverseMirror "The rig seen from the other side: odd signals change sign, loads do not"
  parameter Units.Velocity v = 10.0 "Speed at the start";
  constant Real tolerance(unit="1") = 1e-10 "Of the solver, as in the experiment";
  final parameter Units.Force K = 2.0*Contact.kalkerStiffness(80000.0) "Creep force per creepage";
  final parameter Units.Force slack = 10.0*tolerance*K*v/0.1 "What a solver leaves of two forces";
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 1.0))) "Brake pressure";
  Reference forward(
    pB=p, tauR=500.0, dmuWR=0.0, dmuDC=0.0, muDCunit={1.0, 0.5, 1.0},
    omegaW(start=v/forward.rW), omegaR(start=v/forward.rR));
  // The mirror swaps front and rear: pads and guidance arms stand on the other side of the axle.
  Reference reverse(
    pB=p, tauR=-500.0, dmuWR=0.0, dmuDC=0.0, muDCunit={1.0, 0.5, 1.0},
    side={-1.0, -1.0, -1.0}, lG=-0.5,
    omegaW(start=-v/reverse.rW), omegaR(start=-v/reverse.rR));
  output Units.Force dFx = forward.Fx + reverse.Fx "Difference of the creep forces";
  output Units.AngularVelocity domega = forward.omegaW + reverse.omegaW "Of the angular velocities";
  output Units.Force dFcell = forward.FcellL + reverse.FcellL "Of the left load cells";
  output Units.Force dFz = forward.FzL - reverse.FzL "Of the left wheel loads";
equation
  // A speed may be off by the solver's tolerance of v, tenfold for what adds up, and by 0.1 m/s of
  // rolling (v0 of creepForce) its creepage is largest: 2 N. The others: 1e-4 of the greatest value.
  assert(abs(dFx) < slack, "Creep forces do not mirror");
  assert(abs(domega) < 0.002, "Angular velocities do not mirror");
  assert(abs(dFcell) < slack, "Load cells do not mirror");
  assert(abs(dFz) < 8.0, "Wheel loads differ");
  annotation (experiment(StopTime=4.0, Tolerance=1e-10));
end ForwardAndReverseMirror;
