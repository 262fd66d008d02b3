within WheelsetRig.Tests;
model EffectsMirrorInReverse "Effects of usual size do the same in both directions of rotation"
  constant Real tolerance(unit="1") = 1e-10 "Of the solver, as in the experiment";
  final parameter Units.Force K = 2.0*Contact.kalkerStiffness(80000.0) "Creep force per creepage";
  final parameter Units.Force slack = 10.0*tolerance*K "What a solver leaves of two forces";
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 0.5))) "Brake pressure";
  ChainedEffectsOfSizeZeroAreNominal.AllEffects forward(
    padFriction(
      speed(slope=0.2), force(exponent=0.05), bedding(loss=0.1), thickness(cosine=0.02),
      film(film=0.3), single(film=0.3), heat(fade=4e-4)),
    cylinder(sensor(offset=1000.0), late(lag=0.05), spring(increase=5000.0), caliper(share=0.05)),
    wheelRadius(wear(delta=-0.001), shape(cosine=2e-4)), rollerRadius(delta=0.001),
    wheelLoad(gain=0.1),
    creepStiffness(gain=-0.3), wheelInertia(gain=0.1), rollerInertia(gain=0.05), driveTorque(gain=0.03),
    adhesion(cleaned(gain=0.5, Er=5e4), falling(gain=-0.3)), wheelsetLoss(gain=1.0), rollerLoss(gain=1.0),
    speedSensorW(ring(cosine=0.002), late(delay=0.01)),
    forceSensor(gain(gain=0.01)),
    pB=p, tauR=500.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  ChainedEffectsOfSizeZeroAreNominal.AllEffects reverse(
    padFriction(
      speed(slope=0.2), force(exponent=0.05), bedding(loss=0.1), thickness(cosine=0.02),
      film(film=0.3), single(film=0.3), heat(fade=4e-4)),
    cylinder(sensor(offset=1000.0), late(lag=0.05), spring(increase=5000.0), caliper(share=0.05)),
    wheelRadius(wear(delta=-0.001), shape(cosine=2e-4)), rollerRadius(delta=0.001),
    wheelLoad(gain=0.1),
    creepStiffness(gain=-0.3), wheelInertia(gain=0.1), rollerInertia(gain=0.05), driveTorque(gain=0.03),
    adhesion(cleaned(gain=0.5, Er=5e4), falling(gain=-0.3)), wheelsetLoss(gain=1.0), rollerLoss(gain=1.0),
    speedSensorW(ring(cosine=0.002), late(delay=0.01)),
    forceSensor(gain(gain=0.01)),
    pB=p, tauR=-500.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=-20.0*0.70/0.46), omegaR(start=-20.0));
  output Units.Force dFx = forward.Fx + reverse.Fx "Difference of the creep forces";
  output Units.Force dReading = forward.FxReading + reverse.FxReading "Difference of the readings";
equation
  // A speed that is off by the solver's tolerance is a creepage of that size; tenfold adds up.
  assert(abs(dFx) < slack, "Creep forces do not mirror");
  assert(abs(dReading) < slack, "Readings of the force do not mirror");
  assert(abs(forward.omegaWReading + reverse.omegaWReading) < 1e-6
    and abs(forward.omegaRReading + reverse.omegaRReading) < 1e-6, "Speeds do not mirror");
  assert(abs(forward.pBRest - reverse.pBRest) < 1e-9, "Pressure at rest differs");
  annotation (experiment(StopTime=1.5, Tolerance=1e-10));
end EffectsMirrorInReverse;
