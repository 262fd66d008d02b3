within SealFriction.Effects;
model PressureOffset "a pressure sensor with a wrong zero"
  extends Common.Signals.Offset(offset(unit="Pa", min=-5e4, max=5e4));
  annotation (
    __Workbench(effect(
      size="offset", matters=1000.0, slots={"gauge"}, after="LoadCellOffset",
      separation="its reading in the open air")),
    Documentation(info="<html>
<p>The pressure that acts is what is read, and this. 1000 Pa are 0.5 N.</p>
</html>"));
end PressureOffset;
