within WheelsetRig.Effects;
model DriveTorqueGain "A torque measurement with a wrong gain"
  extends Quantities.PartialDriveTorque;
  parameter Real gain(unit="1", min=-0.2, max=0.2) = 0.0 "Relative change of the reading";
equation
  y = u/(1.0 + gain);
  annotation (
    __Workbench(effect(
      size="gain", matters=0.002,
      separation="a run-up with the wheelset lifted, and dead weights on the load cells")),
    Documentation(info="<html>
<p><code>y = u/(1 + gain)</code>: the reading is the true torque times <code>1 +
gain</code>. An estimate of an inverter is good to 5 %, a flange to 0.1 %.</p>
</html>"));
end DriveTorqueGain;
