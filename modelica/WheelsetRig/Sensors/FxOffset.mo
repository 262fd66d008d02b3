within WheelsetRig.Sensors;
model FxOffset "Load cells whose zero is wrong"
  extends PartialForceSensor;
  parameter Units.Force offset(min=-1000.0, max=1000.0) = 0.0 "Reading without force";
equation
  reading = F + offset;
  annotation (
    __Workbench(effect(
      size="offset", step=20.0, matters=20.0,
      separation="their reading with the wheelset lifted")),
    Documentation(info="<html>
<p><code>reading = F + offset</code>, in either direction of rotation; 50 to 300 N.</p>
</html>"));
end FxOffset;
