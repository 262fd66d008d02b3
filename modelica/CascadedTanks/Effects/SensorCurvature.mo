within CascadedTanks.Effects;
model SensorCurvature "a level sensor whose characteristic is bent"
  extends Common.Interfaces.Signal;
  parameter Real bow(unit="V", min=-3.0, max=3.0) = 0.0 "Reading at the ends beyond that in the middle";
  final parameter Real middle(unit="V") = 5.0 "Of the range";
equation
  y = u + bow*((u - middle)/middle)^2;
  annotation (
    __Workbench(effect(
      size="bow", matters=0.1,
      slots={"sensor"},
      separation="the reading beside a ruler, at several levels")),
    Documentation(info="<html>
<p><code>y = u + bow*(u - middle)^2/middle^2</code>: at both ends of the range, 0 and 10 V, it reads
<code>bow</code> more than in the middle.</p>
</html>"));
end SensorCurvature;
