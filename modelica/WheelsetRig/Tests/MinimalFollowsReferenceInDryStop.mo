within WheelsetRig.Tests;
model MinimalFollowsReferenceInDryStop "Two degrees of freedom suffice for a dry stop"
  parameter Units.Velocity v = 100.0/3.6 "Speed at the start";
  parameter Units.Inertia JTrain = 7840.0 "Inertia that drive and roller imitate";
  Units.Pressure p = 1.35e5*(1.0 + tanh(2.0*(time - 2.0))) "Brake pressure";
  Units.Torque tau = (1.0 - 1500.0/JTrain)*(reference.rR*reference.Fx + reference.rollerLoss.tau)
    "Torque of the inertia-simulating drive, as measured at the reference";
  Reference reference(
    pB=p, tauR=tau, dmuWR=0.0, dmuDC=0.0,
    omegaW(start=v/reference.rW), omegaR(start=v/reference.rR));
  MinimalObserver minimal(
    muWR=0.40, pB=p, tauR=tau, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=v/minimal.rW), omegaR(start=v/minimal.rR));
  output Units.Velocity dv = rR*(reference.omegaR - minimal.omegaR) "Difference of the speeds";
  output Units.Force dFx = reference.Fx - minimal.Fx "Difference of the creep forces";
  output Units.Velocity dslip = reference.slip - minimal.slip "Difference of the slip velocities";
protected
  parameter Units.Length rR = 0.70 "Roller radius";
equation
  // Friction is constant, so both give up the same energy; the wheel load, +3.6 % of 80 kN from
  // the risen frame, changes the slip of 42 mm/s by no more than its own share, 1.5 mm/s.
  assert(abs(dv) < 0.002, "Speeds of the roller differ");
  assert(time < 4.0 or abs(dslip) < 0.002, "Slip velocities differ");
  // 1e-3 of 16 kN: what vibration leaves 2 s after first contact.
  assert(time < 4.0 or abs(dFx) < 16.0, "Creep forces differ");
  annotation (experiment(StopTime=20.0, Tolerance=1e-7));
end MinimalFollowsReferenceInDryStop;
