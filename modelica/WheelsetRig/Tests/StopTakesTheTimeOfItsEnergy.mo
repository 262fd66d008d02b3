within WheelsetRig.Tests;
model StopTakesTheTimeOfItsEnergy "120 km/h, 3.6 bar, constant friction: both models stop when energy says"
  parameter Units.Velocity v = 120.0/3.6 "Speed at the start";
  parameter Units.Inertia JTrain = 7840.0 "Inertia of the train at the roller";
  Reference reference(
    JR=JTrain, pB=3.6e5, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    redeclare Losses.NoLoss wheelsetLoss, redeclare Losses.NoLoss rollerLoss,
    omegaW(start=v/reference.rW), omegaR(start=v/reference.rR));
  MinimalObserver minimal(
    JR=JTrain, muWR=0.40, pB=3.6e5, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0,
    correctionR=0.0, redeclare Losses.NoLoss wheelsetLoss, redeclare Losses.NoLoss rollerLoss,
    omegaW(start=v/minimal.rW), omegaR(start=v/minimal.rR));
  final parameter Units.Torque tauB = 3.0*0.30*0.1086*(3.6e5 - 0.25e5)*0.30 "Torque of the pads";
  final parameter Real T(unit="s") = v/0.46*(110.0 + JTrain*(0.46/0.70)^2)/tauB
    "Kinetic energy over mean braking power, wheel rolling";
equation
  // 1 %: slip is 0.2 %, and the pads' friction fades over the last 0.05 rad/s.
  assert(time > 0.99*T or reference.omegaR > 0.0 and minimal.omegaR > 0.0, "Stops too early");
  assert(time > 0.99*T or reference.rR*reference.omegaR > 0.005*v, "Reference stops too early");
  assert(time > 0.99*T or minimal.rR*minimal.omegaR > 0.005*v, "MinimalObserver stops too early");
  assert(time < 1.01*T or abs(reference.rR*reference.omegaR) < 0.005*v, "Reference stops too late");
  assert(time < 1.01*T or abs(minimal.rR*minimal.omegaR) < 0.005*v, "MinimalObserver stops too late");
  annotation (experiment(StopTime=27.0, Tolerance=1e-7));
end StopTakesTheTimeOfItsEnergy;
