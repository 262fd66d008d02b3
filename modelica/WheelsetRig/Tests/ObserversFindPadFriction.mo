within WheelsetRig.Tests;
model ObserversFindPadFriction "Both observers find the friction of pads that differ from nominal"
  parameter Units.Velocity v = 30.0 "Speed at the start";
  parameter Units.FrictionCoefficient muDC = 0.33 "Friction of the pads";
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 1.0))) "Brake pressure";
  Units.Torque tau = 0.8*rig.rR*rig.Fx "Torque of the drive";
  MinimalObserver rig(
    muWR=0.40, muDC=muDC, pB=p, tauR=tau, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=v/rig.rW), omegaR(start=v/rig.rR));
  Observers.DisturbanceObserver disturbance(
    pB=p, tauR=tau, omegaW=rig.omegaW, omegaR=rig.omegaR,
    plant(omegaW(start=v/rig.rW), omegaR(start=v/rig.rR)));
  Observers.ParameterEstimator estimator(
    pB=p, tauR=tau, omegaW=rig.omegaW, omegaR=rig.omegaR,
    plant(omegaW(start=v/rig.rW), omegaR(start=v/rig.rR)));
equation
  // The pull to nominal, 0.02/s against about 20/s, leaves 3e-5 of the deviation of 0.03.
  assert(time < 4.0 or abs(disturbance.muDC - muDC) < 1e-4, "Disturbance observer is off");
  // Without a pull, what is left is the time since first contact.
  assert(time < 4.0 or abs(estimator.muDC - muDC) < 1e-4, "Parameter estimator is off");
  // 6e-4 of 16.7 kN, several times what the error of muDC makes.
  assert(time < 4.0 or abs(disturbance.Fx - rig.Fx) < 10.0, "Creep force differs");
  annotation (experiment(StopTime=8.0, Tolerance=1e-7));
end ObserversFindPadFriction;
