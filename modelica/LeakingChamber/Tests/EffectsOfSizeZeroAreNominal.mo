within LeakingChamber.Tests;
model EffectsOfSizeZeroAreNominal "A tight chamber keeps its pressure, exactly"
  Chamber nominal(dconductance=0.0);
  Chamber laminar(
    dconductance=0.0, redeclare Effects.LaminarLeak leak, redeclare Effects.WallsCool heat,
    redeclare Effects.GaugeDrift gauge);
  Chamber gas(
    dconductance=0.0, redeclare Effects.CompressibleLaminarLeak leak,
    redeclare Effects.ExpansionCooling heat, redeclare Effects.GaugeOffset gauge);
  Chamber hole(
    dconductance=0.0, redeclare Effects.OrificeLeak leak, redeclare Effects.WarmAtStart heat);
  Chamber draw(dconductance=0.0, redeclare Effects.SteadyDraw leak);
equation
  assert(abs(nominal.pReading - 7e5) <= 0.0, "Not tight");
  assert(
    abs(laminar.pReading - 7e5) + abs(gas.pReading - 7e5) + abs(hole.pReading - 7e5)
      + abs(draw.pReading - 7e5) <= 0.0,
    "An effect of size zero is no nominal model");
  annotation (experiment(StopTime=100.0, Tolerance=1e-8));
end EffectsOfSizeZeroAreNominal;
