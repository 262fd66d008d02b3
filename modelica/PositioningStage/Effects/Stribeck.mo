within PositioningStage.Effects;
model Stribeck "more friction close to standstill"
  extends Common.Friction.Stribeck(v0=1e-3, excess(max=200.0), vS(min=2e-3, max=0.1));
  annotation (
    __Workbench(effect(
      size="excess", matters=0.5, shapes(vS={0.005, 0.03}),
      separation="the force at which the carriage breaks away")),
    Documentation(info="<html>
<p>A film of grease forms as the screw turns; the excess is what it then saves.</p>
</html>"));
end Stribeck;
