within PositioningStage.Effects;
model LoadFriction "dry friction of the nut that grows with the force of the drive"
  extends Common.Friction.LoadDependent(v0=1e-3, mu(max=0.9));
  annotation (
    __Workbench(effect(
      size="mu", matters=0.01,
      separation="the same motion with a heavier load")),
    Documentation(info="<html>
<p>The nut carries the force that the screw passes on.</p>
</html>"));
end LoadFriction;
