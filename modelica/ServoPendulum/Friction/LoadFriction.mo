within ServoPendulum.Friction;
model LoadFriction "Dry friction of the gear that grows with the torque it carries"
  extends Common.RotationalFriction.LoadDependent(v0=1e-4, mu(max=0.9));
  annotation (
    __Workbench(effect(
      size="mu", matters=0.01, slots={"friction"},
      separation="the same motion with a heavier weight")),
    Documentation(info="<html>
<p>The teeth carry the torque of the motor from one side and that of the weight from the other, which
both press on them.</p>
<h4>References</h4>
<p>M. Duclusaud et al. (2025), IEEE ICRA, model M3.</p>
</html>"));
end LoadFriction;
