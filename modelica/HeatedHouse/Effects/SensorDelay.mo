within HeatedHouse.Effects;
model SensorDelay "readings with a time offset"
  extends Common.Signals.Delay(window=60.0, delay(min=-300.0, max=300.0));
  annotation (
    __Workbench(effect(
      size="delay", matters=60.0, slots={"sensor"},
      separation="the clocks of both loggers")),
    Documentation(info="<html>
<p>Power and temperature come from two loggers, of which one may stamp a mean at its end.</p>
</html>"));
end SensorDelay;
