within CascadedTanks.Effects;
model SensorLag "a level sensor that lags behind"
  extends Common.Signals.Lag(lag(max=60.0), window=1.0, past(start=5.0));
  annotation (
    __Workbench(effect(
      size="lag", matters=2.0,
      slots={"sensor"},
      separation="the reading while the tank is emptied at once")),
    Documentation(info="<html>
<p>A narrow pipe to a pressure sensor, or a filter.</p>
</html>"));
end SensorLag;
