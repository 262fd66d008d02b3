within SealFriction.Tests;
model ASealIsShearedBeforeItSlides "After delta on its way, 1 - 1/e of the friction is there"
  parameter Real delta(unit="m") = 5e-4;
  parameter Real rate(unit="m/s") = 0.01;
  Cylinder cylinder(
    p=0.0, s=rate*time, v=rate, dfriction=0.0,
    redeclare Effects.PreslidingFriction seal(coulomb=3.0, delta=delta));
equation
  assert(
    abs(cylinder.F - 3.0*(1.0 - exp(-rate*time/delta))) < 1e-4,
    "Friction does not follow the way");
  annotation (experiment(StopTime=0.3, Tolerance=1e-7));
end ASealIsShearedBeforeItSlides;
