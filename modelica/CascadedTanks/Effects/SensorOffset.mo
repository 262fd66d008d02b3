within CascadedTanks.Effects;
model SensorOffset "a level sensor whose zero is wrong"
  extends Slots.PartialSignal;
  parameter Real offset(unit="V", min=-3.0, max=3.0) = 0.0 "Reading of an empty tank";
equation
  y = u + offset;
  annotation (
    __Workbench(effect(
      size="offset", step=0.05, matters=0.1,
      slots={"sensor"},
      separation="the reading of the empty tank")),
    Documentation(info="<html>
<p><code>y = u + offset</code>.</p>
</html>"));
end SensorOffset;
