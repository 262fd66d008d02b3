within WheelsetRig.Tests;
model PressureOffsetShowsAtRest "Offset and return spring take the same force; only the offset is read"
  Units.Pressure p = 1e5*time "Measured pressure";
  Effects.PressureSensorOffset sensor(pB=p, restBefore=0.0, offset=5000.0);
  Effects.PressureSensorOffset second(pB=sensor.p, restBefore=sensor.rest, offset=1000.0);
  Effects.ReturnSpringPressure spring(pB=p, restBefore=0.0, increase=6000.0);
equation
  // 1e-9: rounding.
  assert(abs(second.p - (p - 6000.0)) < 1e-9 and abs(spring.p - second.p) < 1e-9, "Pressure");
  assert(abs(second.rest - 6000.0) < 1e-9, "Offsets in a chain do not add up at rest");
  assert(abs(spring.rest) < 1e-9, "The return spring is read at rest");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end PressureOffsetShowsAtRest;
