within WheelsetRig.Tests;
model OutOfRoundWheelShakesWithSpeedSquared "Coasting, the creep force ripples with the square of the speed"
  model Coasting "Wheelset on a roller, without losses"
    extends MinimalObserver(
      muWR=0.40, redeclare Brakes.NoActuation actuation,
      redeclare Losses.NoLoss wheelsetLoss, redeclare Losses.NoLoss rollerLoss,
      redeclare Effects.OutOfRoundWheel wheelRadius(cosine=rho));
    parameter Units.Length rho = 2e-4 "Amplitude";
    parameter Units.Velocity vStart "Speed at the start";
    final parameter Units.Mass m = 1.0/(rW^2/JW + rR^2/JR) "Of wheelset and roller at the contact";
    output Real error(unit="1") =
      (Fx - m*rho*(vStart/rW)^2*sin(wheelRadius.phi))/(m*rho*(vStart/rW)^2)
      "Of the creep force, over its amplitude";
  end Coasting;

  Coasting slow(
    vStart=10.0, pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=10.0/0.4602), omegaR(start=10.0/0.70));
  Coasting fast(
    vStart=20.0, pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0/0.4602), omegaR(start=20.0/0.70));
equation
  // The contact lags by a time constant of 0.7 ms at 20 m/s: 3 % of the phase.
  assert(time < 0.05 or abs(slow.error) < 0.05, "Ripple at 10 m/s");
  assert(time < 0.05 or abs(fast.error) < 0.05, "Ripple at 20 m/s");
  annotation (experiment(StopTime=0.6, Tolerance=1e-8));
end OutOfRoundWheelShakesWithSpeedSquared;
