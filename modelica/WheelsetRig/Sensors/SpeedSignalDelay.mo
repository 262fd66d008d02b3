within WheelsetRig.Sensors;
model SpeedSignalDelay "A speed sensor of the wheelset that reads late"
  extends PartialSpeedSensor;
  parameter Real delay(unit="s", min=-0.05, max=0.05) = 0.0 "Time by which the reading is late";
  parameter Real window(unit="s", min=1e-3) = 0.01 "Least time over which the rate is taken";
  Units.AngularVelocity change(start=0.0, fixed=true) "Of omega, within T";
protected
  Real T(unit="s") "Time over which the rate is taken";
equation
  T = sqrt(delay^2 + window^2);
  der(change) = der(omega) - change/T;
  reading = omega - delay/T*change;
  annotation (
    __Workbench(effect(
      size="delay", step=0.001, matters=0.001, slots={"speedSensorW"},
      separation="a step of the drive's torque, compared with steady braking")),
    Documentation(info="<html>
<p>First order of a delay, <code>omega - delay*der(omega)</code>, with the rate taken over the time
<code>T</code>: <code>T^2 = delay^2 + window^2</code>. The reading depends on states alone, so that
a correction of <code>der(omega)</code> does not act on it at once. Filters and gates delay by 2 to
20 ms.</p>
<h4>Limits</h4>
<p>Changes within <code>T</code> are read in part. The speed is steady before the start.</p>
</html>"));
end SpeedSignalDelay;
