within WheelsetRig.Tests;
model SlidingForceFollowsLoad "A sliding wheel bears force in proportion to its load"
  MinimalObserver nominal(
    muWR=0.40, pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=10.0/0.46), omegaR(start=20.0/0.70));
  MinimalObserver heavy(
    redeclare Effects.WheelLoad wheelLoad(gain=0.2),
    muWR=0.40, pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=10.0/0.46), omegaR(start=20.0/0.70));
  output Real ratio(unit="1") = heavy.Fx/nominal.Fx "Of the creep forces";
equation
  // 1e-3: at a slip of 10 m/s the force is 0.5 % from saturation, 6 % of which follow the load;
  // in 10 ms the heavy wheel spins up by 0.1 m/s more.
  assert(time > 0.01 or abs(ratio - 1.2) < 1.2e-3, "Creep force at 120 % of the load");
  annotation (experiment(StopTime=0.05, Tolerance=1e-8));
end SlidingForceFollowsLoad;
