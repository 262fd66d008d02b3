within ServoPendulum.Tests;
model FrictionFollowsTheLoad "Friction of the gear at loads and speeds that define it"
  Friction.LoadFriction load(v=2.0, load=-0.3, mu=0.2);
  Friction.DriveFriction drive(v=-2.0, load=0.3, mu=0.2);
  Friction.LoadStribeck slow(v=0.05, load=-0.3, mu=0.2, vS=0.05);
  Friction.LoadStribeck fast(v=5.0, load=-0.3, mu=0.2, vS=0.05);
  Friction.Stribeck peak(v=0.05, load=0.0, excess=0.2, vS=0.05);
  Friction.DryFriction dry(v=-0.01, load=7.0, coulomb=0.2);
  Friction.QuadraticFriction drag(v=-3.0, load=7.0, drag=1e-4);
equation
  assert(abs(load.f - 0.06) < 1e-12 and abs(drive.f + 0.06) < 1e-12, "Not a fifth of the load");
  assert(abs(slow.f - 0.06*exp(-1.0)) < 1e-12 and fast.f < 1e-12, "The peak has another width");
  assert(abs(peak.f - 0.2*exp(-1.0)) < 1e-12, "At vS there is not 1/e of the excess");
  assert(abs(dry.f + 0.2) < 1e-12, "Dry friction follows load or speed");
  assert(abs(drag.f + 9e-4) < 1e-12, "Drag is not quadratic");
  annotation (experiment(StopTime=0.1, Tolerance=1e-6));
end FrictionFollowsTheLoad;
