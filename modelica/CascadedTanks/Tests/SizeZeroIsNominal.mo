within CascadedTanks.Tests;
model SizeZeroIsNominal "No effect of this library has one by default"
  Real h(unit="V") = 5.0 + 6.0*cos(time) "Level, below zero too";
  Real nominal(unit="V/s") = 0.05*Functions.root(h);
  Effects.UpperOverflow upper(h=h, surplus=sin(time));
  Effects.LowerOverflow lower(h=h, surplus=sin(time));
  Effects.UpperLeak leak(h=h, surplus=sin(time));
  Effects.UpperOutletHead upperHead(nominal=nominal, h=h, k=0.05);
  Effects.LowerOutletHead lowerHead(nominal=nominal, h=h, k=0.05);
  Effects.UpperLaminarOutlet upperLaminar(nominal=nominal, h=h, k=0.05);
  Effects.LowerLaminarOutlet lowerLaminar(nominal=nominal, h=h, k=0.05);
  Effects.LowerTankWidens walls(nominal=nominal, h=h);
  Effects.PumpGainChange gain(u=h);
  Effects.SensorCurvature bent(u=h);
equation
  assert(abs(upper.leaves) + abs(upper.caught) + abs(lower.leaves) + abs(leak.leaves) <= 0.0, "A rim");
  assert(abs(upperHead.actual - nominal) + abs(lowerHead.actual - nominal)
    + abs(upperLaminar.actual - nominal) + abs(lowerLaminar.actual - nominal) <= 0.0, "An outlet");
  assert(abs(walls.actual - nominal) <= 0.0, "Walls");
  assert(abs(gain.y - h) + abs(bent.y - h) <= 0.0, "A signal");
  annotation (experiment(StopTime=7.0, Tolerance=1e-6));
end SizeZeroIsNominal;
