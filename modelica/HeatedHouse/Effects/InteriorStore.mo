within HeatedHouse.Effects;
model InteriorStore "furniture and inner walls that store heat"
  extends Interfaces.PartialShell;
  parameter Real Cm(unit="J/K", min=0.0, max=1e8) = 0.0 "Heat capacity";
  parameter Real lag(unit="s", min=300.0, max=1e5) = 7200.0 "By which it follows the air";
  Real Tm(unit="K", start=293.0, fixed=true, nominal=290.0) "Temperature";
equation
  lag*der(Tm) = T - Tm;
  actual = nominal + Cm*der(Tm);
  annotation (
    __Workbench(effect(
      size="Cm", matters=3e5, shapes(lag={1800.0, 10800.0}), after="ShellStore",
      separation="temperature of walls and furniture")),
    Documentation(info="<html>
<p><code>Cm*Tm' = (T - Tm)*Cm/lag</code>: heat that comes back to the air, none of which leaves.</p>
<h4>References</h4>
<p>P. Bacher, H. Madsen (2011), model TiTm.</p>
</html>"));
end InteriorStore;
