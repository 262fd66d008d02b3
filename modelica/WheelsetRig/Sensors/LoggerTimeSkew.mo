within WheelsetRig.Sensors;
model LoggerTimeSkew "Speed from a logger whose clock is late"
  extends PartialSpeedSensor;
  parameter Real skew(unit="s", min=-0.05, max=0.05) = 0.0 "Time by which the clock is late";
protected
  SpeedSignalDelay late(omega=omega, delay=skew) "The reading is late";
equation
  reading = late.reading;
  annotation (Documentation(info="<html>
<p>As <code>SpeedSignalDelay</code>, for each sensor on the same logger: all of them have the same
<code>skew</code>.</p>
</html>"));
end LoggerTimeSkew;
