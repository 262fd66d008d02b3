within HeatedHouse.Effects;
model HeaterStore "heaters that store heat"
  extends Interfaces.PartialHeater;
  parameter Real Ch(unit="J/K", min=0.0, max=1e7) = 0.0 "Heat capacity of the heaters";
  parameter Real R(unit="K/W", min=1e-5, max=1e-2) = 5e-4 "Resistance from the heaters to the air";
  parameter Real window(unit="s", min=1e-3) = 30.0 "Least time over which the rate is taken";
  Real Th(unit="K", start=293.0, fixed=true, nominal=290.0) "Temperature of the heaters";
equation
  sqrt((R*Ch)^2 + window^2)*der(Th) = T + R*power - Th;
  heat = power - Ch*der(Th);
  annotation (
    __Workbench(effect(
      size="Ch", matters=1e5, shapes(R={2e-4, 1e-3}),
      separation="temperature of the heaters after they are switched")),
    Documentation(info="<html>
<p><code>Ch*Th' = power - (Th - T)/R</code>, what reaches the air is <code>(Th - T)/R</code>: exactly
nothing at zero, the law well above <code>Ch = window/R</code>.</p>
<h4>References</h4>
<p>P. Bacher, H. Madsen (2011), model TiTh.</p>
</html>"));
end HeaterStore;
