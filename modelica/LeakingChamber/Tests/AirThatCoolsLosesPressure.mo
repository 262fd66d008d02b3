within LeakingChamber.Tests;
model AirThatCoolsLosesPressure "In proportion to its temperature, at constant volume"
  Chamber warm(dconductance=0.0, redeclare Effects.WarmAtStart heat(excess=-2.9315, tau=10.0));
  Chamber walls(dconductance=0.0, redeclare Effects.WallsCool heat(slope=-0.029315));
equation
  assert(
    abs((warm.p + 1.013e5)/8.013e5 - exp(0.01*(1.0 - exp(-time/10.0)))) < 1e-6,
    "Does not warm up by a hundredth");
  assert(
    abs((walls.p + 1.013e5)/8.013e5 - exp(-1e-4*time)) < 1e-6,
    "Does not follow the walls");
  annotation (experiment(StopTime=50.0, Tolerance=1e-9));
end AirThatCoolsLosesPressure;
