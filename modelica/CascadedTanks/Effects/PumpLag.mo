within CascadedTanks.Effects;
model PumpLag "flow of the pump that lags behind its voltage"
  extends Common.Signals.Lag(lag(max=60.0), window=1.0, past(start=3.0));
  annotation (
    __Workbench(effect(
      size="lag", matters=2.0,
      slots={"drive"},
      separation="a step of the voltage, with the flow watched")),
    Documentation(info="<html>
<p>Inertia of motor and water, and the way of the water to the tank.</p>
</html>"));
end PumpLag;
