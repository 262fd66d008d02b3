within WheelsetRig.Tests;
model ForwardAndReverseMirror "The rig seen from the other side: odd signals change sign, loads do not"
  parameter Units.Velocity v = 10.0 "Speed at the start";
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
  // 1e-4 of the greatest value: the solver's tolerance, enlarged by the stiff slip.
  assert(abs(dFx) < 2.0, "Creep forces do not mirror");
  assert(abs(domega) < 0.002, "Angular velocities do not mirror");
  assert(abs(dFcell) < 2.0, "Load cells do not mirror");
  assert(abs(dFz) < 8.0, "Wheel loads differ");
  annotation (experiment(StopTime=4.0, Tolerance=1e-8));
end ForwardAndReverseMirror;
