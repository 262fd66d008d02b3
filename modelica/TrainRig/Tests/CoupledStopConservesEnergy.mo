within TrainRig.Tests;
model CoupledStopConservesEnergy "What a train with couplers and sliding axles loses, all that slows it takes"
  Real pressure(unit="Pa") = 2.7e5*(1.0 - exp(-time/0.45)) "Of the first vehicle, of the second less";
  Reference train(
    coupler(each gap=0.02), muWR=0.08, pB1=pressure, pB2=pressure, pB3=0.4*pressure,
    pB4=0.4*pressure, mass1=46e3, mass2=54e3, slope1=4e-3, slope2=6e-3, curve=5e-4,
    vehicle(each v(start=30.0)), axle(each omega(start=65.2)));
  Real taken(unit="J", start=0.0, fixed=true, nominal=1e6) "Work of all that slows the train";
  output Real balance(unit="J") "What is missing";
protected
  parameter Real E0(unit="J") = 0.5*100e3*30.0^2 + 8*0.5*110.0*65.2^2;
equation
  der(taken) = train.taken;
  balance = train.energy + taken - E0;
  // Of 47 MJ: a solver errs by its tolerance in each of some thousand steps.
  assert(abs(balance) < 500.0, "Energy is not conserved");
  assert(time < 15.0 or train.vTrain < 27.0, "The train does not slow down");
  assert(time < 5.0 or train.axle[4].mu0 > 1.05*0.08,
    "Axles that slide do not clean the rail for those behind");
  annotation (experiment(StopTime=20.0, Tolerance=1e-8));
end CoupledStopConservesEnergy;
