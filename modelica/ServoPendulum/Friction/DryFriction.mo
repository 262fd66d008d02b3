within ServoPendulum.Friction;
model DryFriction "Dry friction of gear and bearings"
  extends Common.RotationalFriction.Dry(v0=1e-4, coulomb(max=0.2));
  annotation (
    __Workbench(effect(
      size="coulomb", matters=1e-3, slots={"friction"},
      separation="the least torque that keeps the shaft moving, slowly")),
    Documentation(info="<html>
<p>Of seals, bearings and the preload of teeth: the same at any load.</p>
</html>"));
end DryFriction;
