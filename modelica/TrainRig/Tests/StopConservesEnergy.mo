within TrainRig.Tests;
model StopConservesEnergy "What the train loses, pads, contacts, bearings, air and the gradient take"
  TwoVehicles train(
    pB1=2.4e5, pB2=2.4e5, pB3=2.0e5, pB4=2.4e5, mass1=47e3, mass2=53e3, slope1=4e-3, slope2=6e-3,
    curve=5e-4, dmuDC1=0.0, dmuDC2=0.0, dmuDC3=0.0, dmuDC4=0.0, dmuDC5=0.0, dmuDC6=0.0, dmuDC7=0.0,
    dmuDC8=0.0,
    dr1=0.0, dr2=0.0, dr3=0.0, dr4=0.0, dr5=0.0, dr6=0.0, dr7=0.0, dr8=0.0, dbias=0.0,
    dmuWR=0.0, dmass1=0.0, dmass2=0.0, dA=0.0, dC=0.0, dgradient=0.0,
    vTrain(start=30.0), omega1(start=65.0), omega2(start=65.0), omega3(start=65.0),
    omega4(start=65.0), omega5(start=65.0), omega6(start=65.0), omega7(start=65.0),
    omega8(start=65.0));
  Real taken(unit="J", start=0.0, fixed=true, nominal=1e6) "Work of all that slows the train";
  output Real balance(unit="J") "What is missing";
protected
  parameter Real E0(unit="J") = 0.5*100e3*30.0^2 + 8*0.5*110.0*65.0^2;
  Real uphill(unit="1") = (47e3*4e-3 + 53e3*6e-3)/100e3;
equation
  der(taken) = sum(train.frictionPower) + sum(train.slipPower) + sum(train.lossPower)
    + (1100.0 + 12.0*train.v + 5.5*train.v^2)*train.v + 100e3*9.81*(uphill + 5e-4)*train.v;
  balance = 0.5*100e3*train.v^2
    + 0.5*110.0*(train.omega1^2 + train.omega2^2 + train.omega3^2 + train.omega4^2
    + train.omega5^2 + train.omega6^2 + train.omega7^2 + train.omega8^2) + taken - E0;
  // Of 47 MJ: a solver errs by its tolerance in each of some thousand steps.
  assert(abs(balance) < 500.0, "Energy is not conserved");
  assert(time < 15.0 or train.v < 20.0, "The train does not slow down");
  annotation (experiment(StopTime=20.0, Tolerance=1e-8));
end StopConservesEnergy;
