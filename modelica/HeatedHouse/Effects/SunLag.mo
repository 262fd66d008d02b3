within HeatedHouse.Effects;
model SunLag "sun that warms the floor first"
  extends Common.Signals.Lag(window=60.0, lag(max=36000.0));
  annotation (
    __Workbench(effect(
      size="lag", matters=600.0, slots={"window"},
      separation="a sunny day with the heaters off")),
    Documentation(info="<html>
<p>The floor gives to the air what it took.</p>
</html>"));
end SunLag;
