within WheelsetRig.Effects;
model WheelsetLosses "Losses of the wheelset other than nominal"
  extends Losses.PartialLoss;
  parameter Real gain(unit="1", min=-0.95, max=3.0) = 0.0 "Relative change";
  Losses.WheelsetLoss known(omega=omega) "Nominal losses";
equation
  tau = (1.0 + gain)*known.tau;
  annotation (
    __Workbench(effect(
      size="gain", matters=0.15, slots={"wheelsetLoss"},
      separation="a long coast-down without brake, in both directions")),
    Documentation(info="<html>
<p><code>tau = (1 + gain)*known.tau</code>. Estimates of bearings and windage are good to a factor
of three.</p>
</html>"));
end WheelsetLosses;
