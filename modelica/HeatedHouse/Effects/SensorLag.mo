within HeatedHouse.Effects;
model SensorLag "a thermometer that lags behind the air"
  extends Common.Signals.Lag(window=30.0, lag(max=3600.0), past(start=293.0));
  annotation (
    __Workbench(effect(
      size="lag", matters=60.0, slots={"sensor"},
      separation="the reading when the thermometer is carried outside")),
    Documentation(info="<html>
<p>Of its own heat capacity.</p>
<h4>References</h4>
<p>P. Bacher, H. Madsen (2011), model TiTs.</p>
</html>"));
end SensorLag;
