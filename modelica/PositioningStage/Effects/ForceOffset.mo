within PositioningStage.Effects;
model ForceOffset "a constant force: a slope, or an offset of the drive"
  extends Common.Signals.Offset(offset(unit="N", min=-50.0, max=50.0));
  annotation (
    __Workbench(effect(
      size="offset", matters=0.3, slots={"drive"},
      separation="the carriage at rest, turned around")),
    Documentation(info="<html>
<p>Dry friction that differs between the directions is one too, while the carriage moves.</p>
</html>"));
end ForceOffset;
