within WheelsetRig.Tests;
model SensorsChangeTheirReadingOnly "Ideal sensors read the truth; a sensor with a gain changes its reading only"
  model SpeedSensorWithGain "Wrong number of teeth"
    extends Sensors.PartialSpeedSensor;
    parameter Real gain(unit="1") = 1.1;
  equation
    y = gain*u;
  end SpeedSensorWithGain;

  model ForceSensorWithGain "Wrong calibration"
    extends Sensors.PartialForceSensor;
    parameter Real gain(unit="1") = 0.9;
  equation
    y = gain*u;
  end ForceSensorWithGain;

  constant Real tolerance(unit="1") = 1e-10 "Of the solver, as in the experiment";
  final parameter Units.Force K = 2.0*Contact.kalkerStiffness(80000.0) "Creep force per creepage";
  final parameter Units.Force slack = 10.0*tolerance*K "What a solver leaves of two forces";
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 0.5))) "Brake pressure";
  MinimalObserver minimal(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  MinimalObserver minimalGain(
    redeclare SpeedSensorWithGain speedSensorW, redeclare SpeedSensorWithGain speedSensorR(gain=1.2),
    redeclare ForceSensorWithGain forceSensor, pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    correctionW=0.0, correctionR=0.0, omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  FullObserver full(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  FullObserver fullGain(
    redeclare SpeedSensorWithGain speedSensorW, redeclare SpeedSensorWithGain speedSensorR(gain=1.2),
    redeclare ForceSensorWithGain forceSensor, pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    correctionW=0.0, correctionR=0.0, omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  Reference reference(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  Reference referenceGain(
    redeclare SpeedSensorWithGain speedSensorW, redeclare SpeedSensorWithGain speedSensorR(gain=1.2),
    redeclare ForceSensorWithGain forceSensor, pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  output Units.Force dMinimal = minimalGain.Fx - minimal.Fx "Change of MinimalObserver";
  output Units.Force dFull = fullGain.Fx - full.Fx "Change of FullObserver";
  output Units.Force dReference = referenceGain.Fx - reference.Fx "Change of Reference";
equation
  // The same number under another name: the last digits of 40 rad/s and 20 kN.
  assert(abs(minimal.omegaWReading - minimal.omegaW) < 1e-12
    and abs(minimal.omegaRReading - minimal.omegaR) < 1e-12
    and abs(minimal.FxReading - minimal.Fx) < 1e-9, "MinimalObserver: ideal sensors");
  assert(abs(full.omegaWReading - full.omegaW) < 1e-12
    and abs(full.omegaRReading - full.omegaR) < 1e-12
    and abs(full.FxReading - full.Fx) < 1e-9, "FullObserver: ideal sensors");
  assert(abs(reference.omegaWReading - reference.omegaW) < 1e-12
    and abs(reference.omegaRReading - reference.omegaR) < 1e-12
    and abs(reference.FxReading - reference.FcellL - reference.FcellR) < 1e-9,
    "Reference: ideal sensors");
  // Products are rounded once: 1e-15 of 40 rad/s and 20 kN; 1e-10 and 1e-7 are slack.
  assert(abs(minimalGain.omegaWReading - 1.1*minimalGain.omegaW) < 1e-10
    and abs(minimalGain.omegaRReading - 1.2*minimalGain.omegaR) < 1e-10
    and abs(minimalGain.FxReading - 0.9*minimalGain.Fx) < 1e-7, "MinimalObserver: gains");
  assert(abs(fullGain.omegaWReading - 1.1*fullGain.omegaW) < 1e-10
    and abs(fullGain.omegaRReading - 1.2*fullGain.omegaR) < 1e-10
    and abs(fullGain.FxReading - 0.9*fullGain.Fx) < 1e-7, "FullObserver: gains");
  assert(abs(referenceGain.omegaWReading - 1.1*referenceGain.omegaW) < 1e-10
    and abs(referenceGain.omegaRReading - 1.2*referenceGain.omegaR) < 1e-10
    and abs(referenceGain.FxReading - 0.9*(referenceGain.FcellL + referenceGain.FcellR)) < 1e-7,
    "Reference: gains");
  // A speed that is off by the solver's tolerance is a creepage of that size; tenfold adds up.
  assert(abs(dMinimal) < slack, "MinimalObserver changes");
  assert(abs(dFull) < slack, "FullObserver changes");
  assert(abs(dReference) < slack, "Reference changes");
  annotation (experiment(StopTime=1.0, Tolerance=1e-10));
end SensorsChangeTheirReadingOnly;
