within LeakingChamber.Effects;
model GaugeDrift "a pressure sensor that drifts"
  extends Common.Interfaces.Signal;
  parameter Real drift(unit="Pa/s", min=-1e4, max=1e4) = 0.0 "Rate of its zero";
  Real t(unit="s", start=0.0, fixed=true) "Time";
equation
  der(t) = 1.0;
  y = u + drift*t;
  annotation (
    __Workbench(effect(
      size="drift", matters=17.0, slots={"gauge"},
      separation="its reading at a pressure that is kept")),
    Documentation(info="<html>
<p>A sensor that warms up. 17 Pa/s are 20 mbar in two minutes.</p>
</html>"));
end GaugeDrift;
