within CascadedTanks.Effects;
model SensorOffset "a level sensor whose zero is wrong"
  extends Common.Signals.Offset(offset(unit="V", min=-3.0, max=3.0));
  annotation (
    __Workbench(effect(
      size="offset", matters=0.1,
      slots={"sensor"},
      separation="the reading of the empty tank")),
    Documentation(info="<html>
<p>A sensor that was not set to zero with the tank empty.</p>
</html>"));
end SensorOffset;
