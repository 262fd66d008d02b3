within WheelsetRig.Tests;
model FullReturnsToItsWheelLoad "In steady braking the frame has risen by 3*F/kF and the wheel load is back"
  FullObserver full(
    pB=1.35e5*(1.0 + tanh(2.0*(time - 2.0))), dmuWR=0.0, dmuDC=0.0, correctionW=0.0,
    correctionR=0.0, tauR=full.rR*full.Fx + full.rollerLoss.tau,
    omegaW(start=30.0/0.46), omegaR(start=30.0/0.70)) "Held at constant speed by the drive";
  final parameter Units.Force F = 0.30*0.1086*(2.7e5 - 0.25e5) "Friction force of one unit";
equation
  // Bounce decays with 3.5 1/s: 1e-6 is left of it 4 s after first contact; 1e-4 is slack.
  assert(time < 6.5 or abs(full.zF - 3.0*F/full.kF) < 1e-4*3.0*F/full.kF, "Rise of the frame");
  assert(time < 6.5 or abs(full.betaB - full.lB*F/full.kB) < 1e-4*full.lB*F/full.kB, "Pitch");
  assert(time < 6.5 or abs(full.Fz - full.Fz0) < 1e-4*full.Fz0, "Wheel load");
  assert(time < 1.0 or time > 3.0 or abs(full.zF) < 0.02, "The frame jumps");
  annotation (experiment(StopTime=8.0, Tolerance=1e-8));
end FullReturnsToItsWheelLoad;
