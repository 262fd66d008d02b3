within SealFriction.Effects;
model LoadCellOffset "a load cell with a wrong zero"
  extends Common.Signals.Offset(offset(unit="N", min=-20.0, max=20.0));
  annotation (
    __Workbench(effect(
      size="offset", matters=0.5, slots={"loadCell"},
      separation="its reading without load")),
    Documentation(info="<html>
<p>A wrong gain is no effect of its own: it is a wrong area.</p>
</html>"));
end LoadCellOffset;
