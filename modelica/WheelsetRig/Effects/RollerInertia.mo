within WheelsetRig.Effects;
model RollerInertia "An inertia of the roller other than nominal"
  extends Quantities.PartialRollerInertia;
  extends Common.Signals.Gain(gain(min=-0.05, max=0.05));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.002, after="FxGain",
      separation="a spin-down of the roller alone, the drive off")),
    Documentation(info="<html>
<p><code>y = u*(1 + gain)</code>. A drive that imitates a train takes a torque that goes with
the deceleration, so that in a stop 1 % of inertia looks like a torque that reads 0.2 % too
little. An inertia is computed from drawings to 1 %, so that 5 % bound it.</p>
</html>"));
end RollerInertia;
