within Effects.Tests;
model FrictionFollowsItsCurve "Parts of the friction curve at points that define them"
  Real v = 0.1 + time "Velocity, above ten times v0";
  Friction.Dry dry(v=v, load=0.0, coulomb=5.0);
  Friction.Dry dryBack(v=-v, load=0.0, coulomb=5.0);
  Friction.Dry standing(v=0.0, load=0.0, coulomb=5.0);
  Friction.Viscous viscous(v=v, load=0.0, damping=3.0);
  Friction.Stribeck peak(v=0.2, load=0.0, excess=2.0, vS=0.2);
  Friction.Stribeck past(v=1.0, load=0.0, excess=2.0, vS=0.2);
  Friction.LoadDependent loaded(v=v, load=40.0, mu=0.1);
  Friction.LoadDependent pulled(v=-v, load=-40.0, mu=0.1);
  Friction.Quadratic drag(v=-v, load=0.0, drag=2.0);
equation
  // 1 - tanh(10) is 4e-9.
  assert(abs(dry.f - 5.0) < 1e-7 and abs(dryBack.f + 5.0) < 1e-7, "Dry friction is not constant");
  assert(abs(standing.f) <= 0.0, "Dry friction at standstill");
  assert(abs(viscous.f - 3.0*v) < 1e-12, "Viscous friction is not proportional");
  assert(abs(peak.f - 2.0*exp(-1.0)) < 1e-7, "At vS there is not 1/e of the excess");
  assert(past.f < 1e-9, "At 5 vS the peak is not over");
  assert(abs(loaded.f - 4.0) < 1e-7 and abs(pulled.f + 4.0) < 1e-7, "Not a tenth of the load");
  assert(abs(drag.f + 2.0*v^2) < 1e-12, "Drag is not quadratic, or does not resist");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end FrictionFollowsItsCurve;
