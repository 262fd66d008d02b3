within WheelsetRig.Tests;
model ZeroEffectIsNominal "A redeclared effect of size zero is the nominal model exactly"
  model SpeedEffect "Pad friction that changes with speed"
    extends Brakes.PartialPadFriction;
    parameter Real gain(unit="1") "Relative change per 10 m/s";
  equation
    mu = level*(1.0 + gain*v/10.0);
  end SpeedEffect;

  model WithEffect "Short as a user writes it"
    extends MinimalObserver(redeclare SpeedEffect padFriction(gain=0.0));
  end WithEffect;

  constant Real tolerance(unit="1") = 1e-10 "Of the solver, as in the experiment";
  final parameter Units.Force K = 2.0*Contact.kalkerStiffness(80000.0) "Creep force per creepage";
  final parameter Units.Force slack = 10.0*tolerance*K "What a solver leaves of two forces";
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 0.5))) "Brake pressure";
  MinimalObserver minimal(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  WithEffect minimalZero(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  MinimalObserver minimalOne(
    redeclare SpeedEffect padFriction(gain=0.1), pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    correctionW=0.0, correctionR=0.0, omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  FullObserver full(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  FullObserver fullZero(
    redeclare SpeedEffect padFriction(gain=0.0), pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    correctionW=0.0, correctionR=0.0, omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  Reference reference(
    pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0, omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  Reference referenceZero(
    redeclare SpeedEffect padFriction[3](each gain=0.0), pB=p, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  output Units.Force dMinimal = minimalZero.Fx - minimal.Fx "Change of MinimalObserver";
  output Units.Force dFull = fullZero.Fx - full.Fx "Change of FullObserver";
  output Units.Force dReference = referenceZero.Fx - reference.Fx "Change of Reference";
equation
  // A speed that is off by the solver's tolerance is a creepage of that size; tenfold adds up.
  assert(abs(dMinimal) < slack, "MinimalObserver changes");
  assert(abs(dFull) < slack, "FullObserver changes");
  assert(abs(dReference) < slack, "Reference changes");
  // The counterexample: +9 % friction at 9 m/s sliding velocity must show.
  assert(time < 0.9 or abs(minimalOne.Fx - minimal.Fx) > 500.0, "The effect has no effect");
  annotation (experiment(StopTime=1.0, Tolerance=1e-10));
end ZeroEffectIsNominal;
