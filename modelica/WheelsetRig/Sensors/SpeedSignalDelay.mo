within WheelsetRig.Sensors;
model SpeedSignalDelay "A speed sensor of the wheelset that reads late"
  extends PartialSpeedSensor;
  extends Common.Signals.Delay(
    delay(min=-0.05, max=0.05), window(min=1e-3), change(unit="rad/s"));
  annotation (
    __Workbench(effect(
      size="delay", matters=0.001, slots={"speedSensorW"},
      separation="a step of the drive's torque, compared with steady braking")),
    Documentation(info="<html>
<p>Filters and gates delay by 2 to 20 ms.</p>
</html>"));
end SpeedSignalDelay;
