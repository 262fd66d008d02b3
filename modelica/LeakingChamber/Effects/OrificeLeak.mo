within LeakingChamber.Effects;
model OrificeLeak "a hole, or a seat that does not close"
  extends Common.Leaks.Orifice(C(max=1e-7));
  annotation (
    __Workbench(effect(
      size="C", matters=2e-14,
      separation="the flow at several pressures that are kept, down to the room's")),
    Documentation(info="<html>
<p>1e-10 m3/(s.Pa) are a hole of a quarter of a millimetre. Above one bar the flow is choked, and in
proportion to the absolute pressure.</p>
</html>"));
end OrificeLeak;
