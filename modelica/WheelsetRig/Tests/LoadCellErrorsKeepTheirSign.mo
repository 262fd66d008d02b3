within WheelsetRig.Tests;
model LoadCellErrorsKeepTheirSign "A gain turns with the force; offset and apex do not"
  Units.Force F = 20000.0*(1.0 - 2.0*time) "Creep force, turns at 0.5 s";
  Effects.ApexOffset apex(u=F, Q=80000.0, offset=0.001);
  Effects.ApexOffset laden(u=F, Q=88000.0, offset=0.001) "With a load of passengers";
  Sensors.FxGain gain(u=F, Q=80000.0, gain=0.015);
  Sensors.FxOffset zero(u=F, Q=80000.0, offset=120.0);
equation
  // 160 kN leaning by 1 mm on radii of 1.16 m: 138 N, given to 1 N. 1e-9: rounding.
  assert(abs(apex.y - F - 138.0) < 1.0, "Apex");
  assert(abs(laden.y - F - 1.1*(apex.y - F)) < 1e-9, "Apex in proportion to the wheel load");
  assert(abs(gain.y - F - 300.0*(1.0 - 2.0*time)) < 1e-9, "Gain");
  assert(abs(zero.y - F - 120.0) < 1e-9, "Offset");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end LoadCellErrorsKeepTheirSign;
