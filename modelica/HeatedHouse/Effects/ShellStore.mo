within HeatedHouse.Effects;
model ShellStore "walls that store heat on its way out"
  extends Interfaces.PartialShell;
  parameter Real heavy(unit="1", min=0.0, max=1.0) = 0.0 "Share of the conductance of walls that do";
  parameter Real inside(unit="1", min=0.01, max=0.99) = 0.1 "Share of their resistance inside the store";
  parameter Real lag(unit="s", min=300.0, max=1e5) = 7200.0 "By which they follow";
  Real Te(unit="K", start=290.0, fixed=true, nominal=290.0) "Temperature of the walls";
  Real Ce(unit="J/K", nominal=1e7) = heavy*G*lag/(inside*(1.0 - inside)) "Their heat capacity";
equation
  lag*der(Te) = T - inside*nominal/G - Te;
  actual = nominal + (1.0 - inside)*Ce*der(Te);
  annotation (
    __Workbench(effect(
      size="heavy", matters=0.02, shapes(lag={3600.0, 14400.0}),
      separation="temperature of the walls")),
    Documentation(info="<html>
<p><code>Ce*Te' = (T - Te)/(inside*R) - (Te - Ta)/((1 - inside)*R)</code> with <code>R = 1/(heavy*G)</code>;
the air loses the first of both flows, and heat through what is light at once.</p>
<p>What stores heat is a lining in front of the insulation. To the air it has the resistance of a
surface and of half its thickness, some 0.2 m2.K/W of 2 in all.</p>
<h4>References</h4>
<p>ISO 6946:2017, <em>Building components and building elements</em>: 0.13 m2.K/W of a surface inside. P. Bacher, H. Madsen (2011), model TiTe; TiTeRia where <code>heavy</code> is below 1.</p>
</html>"));
end ShellStore;
