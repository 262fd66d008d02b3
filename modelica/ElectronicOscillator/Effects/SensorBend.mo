within ElectronicOscillator.Effects;
model SensorBend "a reading that bends"
  extends Common.Interfaces.Signal;
  parameter Real bend(unit="1/V2", min=-3.0, max=3.0) = 0.0 "Relative change per square of it";
equation
  y = u*(1.0 + bend*u^2);
  annotation (
    __Workbench(effect(
      size="bend", matters=0.05, slots={"sensor"}, after="CubicSpring",
      separation="the reading beside that of another card")),
    Documentation(info="<html>
<p><code>y = u*(1 + bend*u^2)</code>.</p>
</html>"));
end SensorBend;
