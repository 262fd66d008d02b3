within CascadedTanks.Effects;
model SensorSaturation "a level sensor that reads less and less above some level"
  extends Slots.PartialSignal;
  parameter Real share(unit="1", min=0.0, max=1.0) = 0.0 "Of what exceeds the limit, that is lost";
  parameter Real limit(unit="V", min=3.0, max=10.0) = 8.0 "Where it begins";
equation
  y = u - share*Functions.above(u - limit);
  annotation (
    __Workbench(effect(
      size="share", step=0.05, matters=0.1,
      shapes(limit={6.0, 8.0, 9.5}),
      slots={"sensor"},
      separation="the reading beside a ruler, at several levels")),
    Documentation(info="<html>
<p><code>y = u - share*max(0, u - limit)</code>. Where the reading ends altogether is no effect but a
property of the signal.</p>
</html>"));
end SensorSaturation;
