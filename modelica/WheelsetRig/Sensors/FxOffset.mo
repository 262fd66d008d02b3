within WheelsetRig.Sensors;
model FxOffset "Load cells whose zero is wrong"
  extends PartialForceSensor;
  extends Common.Signals.Offset(offset(unit="N", min=-1000.0, max=1000.0));
  annotation (
    __Workbench(effect(
      size="offset", matters=20.0,
      separation="their reading with the wheelset lifted")),
    Documentation(info="<html>
<p>The reading without force, in either direction of rotation; 50 to 300 N.</p>
</html>"));
end FxOffset;
