within ElectronicOscillator.Tests;
model ForcesFollowTheirLaws "Each force by its formula, at one displacement and rate"
  Effects.SquareSpring square(v=-3.0, y=-0.2, k2=5.0);
  Effects.AbsoluteSpring either(v=-3.0, y=-0.2, k1=0.5);
  Effects.QuadraticDamping fast(v=-3.0, y=-0.2, d2=1e-5);
  Effects.DryFriction dry(v=-30.0, y=-0.2, coulomb=0.01);
  Effects.DisplacedDamping far(v=-3.0, y=-0.2, dy=0.1);
  Effects.SourceBend source(u=0.1, bend=5.0);
  Effects.SensorBend sensor(u=-0.2, bend=0.5);
equation
  assert(abs(square.f - 0.2) < 1e-12, "square");
  assert(abs(either.f - 0.1) < 1e-12, "either side");
  assert(abs(fast.f + 9e-5) < 1e-15, "quadratic");
  assert(abs(dry.f + 0.01) < 1e-12, "dry");
  assert(abs(far.f + 0.012) < 1e-12, "displaced");
  assert(abs(source.y - 0.105) < 1e-12, "source");
  assert(abs(sensor.y + 0.204) < 1e-12, "sensor");
  annotation (experiment(StopTime=0.1, Tolerance=1e-6));
end ForcesFollowTheirLaws;
