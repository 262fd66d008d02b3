within SealFriction.Tests;
model NominalForceIsPressureTimesArea "Effects of size zero: 5 bar on 25 mm are 245.4 N at any rate"
  Cylinder nominal(p=5e5, s=0.02, v=0.01*sin(time), dfriction=0.0);
  Cylinder all(
    p=5e5, s=0.02, v=0.01*sin(time), dfriction=0.0,
    redeclare Effects.PressureFriction seal,
    redeclare Effects.SpringForce spring,
    redeclare Effects.PressureOffset gauge,
    redeclare Effects.LoadCellLag loadCell);
equation
  assert(abs(nominal.FReading - 245.437) < 1e-3, "Not the force of the pressure");
  assert(abs(all.FReading - nominal.FReading) <= 0.0, "An effect of size zero is no nominal model");
  annotation (experiment(StopTime=10.0, Tolerance=1e-6));
end NominalForceIsPressureTimesArea;
