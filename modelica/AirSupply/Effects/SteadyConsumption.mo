within AirSupply.Effects;
model SteadyConsumption "a consumer that takes the same at any pressure"
  extends Common.Leaks.Steady(rate(max=0.01));
  annotation (
    __Workbench(effect(
      size="rate", matters=5e-5,
      separation="the fall of the pressure from full to half with the compressor off; a valve in the line to the consumers")),
    Documentation(info="<html>
<p>Consumers behind a pressure regulator, averaged over their strokes.</p>
</html>"));
end SteadyConsumption;
