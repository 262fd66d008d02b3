within PositioningStage.Effects;
model QuadraticFriction "drag that grows with the square of the speed"
  extends Common.Friction.Quadratic(drag(max=5000.0));
  annotation (
    __Workbench(effect(
      size="drag", matters=30.0,
      separation="runs at several constant speeds")),
    Documentation(info="<html>
<p>Windage; at these speeds it should be nothing.</p>
</html>"));
end QuadraticFriction;
