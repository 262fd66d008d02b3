within WheelsetRig.Sensors;
model LoggerTimeSkew "A logger of the speeds whose clock is late"
  extends PartialSpeedSensor;
  parameter Real skew(unit="s", min=-0.05, max=0.05) = 0.0 "Time by which the clock is late";
protected
  SpeedSignalDelay late(u=u, delay=skew) "The reading is late";
equation
  y = late.y;
  annotation (
    __Workbench(effect(
      size="skew", matters=0.001, slots={"speedSensorW", "speedSensorR"},
      separation="a step of the drive's torque, compared with steady braking")),
    Documentation(info="<html>
<p>As <code>SpeedSignalDelay</code>, for each sensor on the same logger: all of them have the same
<code>skew</code>.</p>
</html>"));
end LoggerTimeSkew;
