within AirSupply.Effects;
model DeliveryLag "delivery that lags behind the valve, at starts and at stops"
  extends Common.Signals.Lag(lag(max=60.0), window=1.0);
  annotation (
    __Workbench(effect(
      size="lag", matters=2.0,
      slots={"running"},
      separation="pressure at its outlet, sampled ten times as often")),
    Documentation(info="<html>
<p>Pipes, cooler and dryer between the compressor and the reservoir.</p>
</html>"));
end DeliveryLag;
