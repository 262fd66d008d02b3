within PositioningStage.Effects;
model DryFriction "dry friction of screw and rails"
  extends Common.Friction.Dry(v0=1e-3, coulomb(max=200.0));
  annotation (
    __Workbench(effect(
      size="coulomb", matters=0.5,
      separation="a slow run at constant speed")),
    Documentation(info="<html>
<p>Preloaded balls roll, and seals slide, at any speed alike.</p>
</html>"));
end DryFriction;
