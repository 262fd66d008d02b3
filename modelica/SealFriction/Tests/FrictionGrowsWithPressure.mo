within SealFriction.Tests;
model FrictionGrowsWithPressure "6e-6 m2 are 0.6 N per bar, on both ways"
  Cylinder into(p=7e5, s=0.02, v=0.01, dfriction=0.0, redeclare Effects.PressureFriction seal(mu=6e-6));
  Cylinder out(p=7e5, s=0.02, v=-0.01, dfriction=0.0, redeclare Effects.PressureFriction seal(mu=6e-6));
equation
  assert(abs(into.F - out.F - 2.0*7.0*0.6) < 1e-9, "Not in proportion to the pressure");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end FrictionGrowsWithPressure;
