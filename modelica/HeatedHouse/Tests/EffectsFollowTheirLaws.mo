within HeatedHouse.Tests;
model EffectsFollowTheirLaws "Each at rest by its formula, and none by default"
  Effects.Infiltration leak(nominal=1900.0, T=293.0, G=190.0, k=2.0);
  Effects.InternalGain gain(power=500.0, T=293.0, gain=-40.0);
  Effects.SunOnShell walls(u=1000.0, share=0.5, lag(min=1.0)=7.2);
  Effects.HeaterStore heater(power=100.0*sin(time), T=293.0);
  Effects.ShellStore shell(nominal=100.0*sin(time), T=293.0, G=190.0);
  Effects.InteriorStore interior(nominal=100.0, T=293.0 + sin(time), G=190.0);
equation
  assert(abs(leak.actual - 2100.0) < 1e-9, "Not k*dT^2 more");
  assert(abs(gain.heat - 460.0) < 1e-9, "Not less by the gain");
  assert(abs(walls.y - 1000.0 - 500.0*(1.0 - exp(-time/7.2))) < 1e-3, "Not late by the lag");
  assert(abs(heater.heat - heater.power) + abs(shell.actual - shell.nominal)
    + abs(interior.actual - interior.nominal) <= 0.0, "Something by default");
  annotation (experiment(StopTime=20.0, Tolerance=1e-9));
end EffectsFollowTheirLaws;
