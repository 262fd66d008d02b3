within CascadedTanks.Effects;
model SensorSaturation "a level sensor that reads less and less above some level"
  extends Common.Signals.Saturation(high(unit="V", min=1.0, max=10.0));
  annotation (
    __Workbench(effect(
      size="share", matters=0.1,
      shapes(high={6.0, 8.0, 9.5}),
      slots={"sensor"},
      separation="the reading beside a ruler, at several levels")),
    Documentation(info="<html>
<p>Of what exceeds <code>high</code> a share is lost. Where the reading ends altogether is no effect but a
property of the signal.</p>
</html>"));
end SensorSaturation;
