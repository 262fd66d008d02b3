within AirSupply.Effects;
model WarmingUp "a compressor that delivers less as it warms up"
  extends Slots.PartialDelivery;
  parameter Real share(unit="1", min=0.0, max=0.3) = 0.0 "Loss of delivery from cold to warm";
  final parameter Real tau(unit="s") = 100.0 "Time constant";
  Real warmth(unit="1", start=0.0, fixed=true) "0 cold, 1 warm";
equation
  tau*der(warmth) = runs - warmth;
  actual = nominal*(1.0 - share*(warmth - 0.5));
  annotation (
    __Workbench(effect(
      size="share", matters=0.05,
      slots={"compressor"},
      separation="two starts, from cold and shortly after a stop")),
    Documentation(info="<html>
<p><code>actual = nominal*(1 - share*(warmth - 1/2))</code>, where warmth rises to 1 with the time constant
<code>tau</code> while it runs, and falls as it cools: warm walls heat the air that is
taken in, by 100 K at most, which is a third of its density.</p>
</html>"));
end WarmingUp;
