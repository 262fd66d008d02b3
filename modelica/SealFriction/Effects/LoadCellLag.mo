within SealFriction.Effects;
model LoadCellLag "a load cell whose amplifier is late"
  extends Common.Signals.Lag(lag(max=1.0), past(unit="N", nominal=100.0));
  annotation (
    __Workbench(effect(
      size="lag", matters=0.01, slots={"loadCell"},
      separation="a blow on the load cell")),
    Documentation(info="<html>
<p>All effects that follow the rate are seen late by as much.</p>
</html>"));
end LoadCellLag;
