within HeatedHouse.Effects;
model SunOnShell "sun on the walls, whose heat comes in later"
  extends Common.Interfaces.Signal;
  parameter Real share(unit="1", min=0.0, max=5.0) = 0.0 "Of that through the windows";
  parameter Real lag(unit="s", min=600.0, max=1e5) = 7200.0 "By which it comes later";
  Real stored(unit="W", start=0.0, fixed=true, nominal=1000.0) "Heat that comes in, of a share of 1";
equation
  lag*der(stored) = u - stored;
  y = u + share*stored;
  annotation (
    __Workbench(effect(
      size="share", matters=0.05, slots={"window"}, shapes(lag={3600.0, 14400.0}),
      separation="a sunny day behind closed shutters")),
    Documentation(info="<html>
<p>Walls that the sun warms lose so much less heat from inside, late by what they store.</p>
<h4>References</h4>
<p>P. Bacher, H. Madsen (2011), model TiTeAe.</p>
</html>"));
end SunOnShell;
