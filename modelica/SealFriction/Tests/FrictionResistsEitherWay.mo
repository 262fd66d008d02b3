within SealFriction.Tests;
model FrictionResistsEitherWay "Dry friction of 3 N: 6 N between the way in and the way out"
  Cylinder into(p=3e5, s=0.02, v=0.01, dfriction=0.0, redeclare Effects.DryFriction seal(coulomb=3.0));
  Cylinder out(p=3e5, s=0.02, v=-0.01, dfriction=0.0, redeclare Effects.DryFriction seal(coulomb=3.0));
  Cylinder corrected(p=3e5, s=0.02, v=0.01, dfriction=3.0);
equation
  assert(abs(into.F - out.F - 6.0) < 1e-9, "Not twice the friction");
  assert(abs(corrected.F - into.F) < 1e-9, "The correction is no friction");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end FrictionResistsEitherWay;
