within HeatedHouse.Effects;
model ShellStore "walls that store heat on its way out"
  extends Interfaces.PartialShell;
  parameter Real Ce(unit="J/K", min=0.0, max=1e8) = 0.0 "Heat capacity of the walls";
  parameter Real inside(unit="1", min=0.01, max=0.99) = 0.3 "Share of the resistance inside of it";
  parameter Real window(unit="s", min=1e-3) = 60.0 "Least time over which the rate is taken";
  Real Te(unit="K", start=290.0, fixed=true, nominal=290.0) "Temperature of the walls";
equation
  sqrt((Ce*inside*(1.0 - inside)/G)^2 + window^2)*der(Te) = T - inside*nominal/G - Te;
  actual = nominal + (1.0 - inside)*Ce*der(Te);
  annotation (
    __Workbench(effect(
      size="Ce", matters=3e5, shapes(inside={0.15, 0.5}),
      separation="temperature of the walls")),
    Documentation(info="<html>
<p><code>Ce*Te' = (T - Te)/(inside*R) - (Te - Ta)/((1 - inside)*R)</code> with <code>R = 1/G</code>; the
air loses the first of both flows. Exactly nothing at zero.</p>
<h4>References</h4>
<p>P. Bacher, H. Madsen (2011), model TiTe.</p>
</html>"));
end ShellStore;
