//! Random objects: an interface, a block that implements it, one that extends that, instances of all, and what a program does with them.

use super::Generator;
use super::shape::{Shape, Variable, named};

/// The interface `it` of a program with its blocks `oa` and `ob`.
#[derive(Debug, Clone)]
pub struct Objects {
    /// Inputs of the method `act`.
    inputs: Vec<(String, Shape)>,
    /// What `act` gives.
    result: Shape,
    /// Type of the property `prop`.
    property: Shape,
    /// Instances that can be named in the main program.
    instances: Vec<String>,
}

impl Generator {
    /// The types.
    pub(super) fn hierarchy(&mut self) {
        let inputs = {
            let n = self.random.below(3);
            (0..n).map(|i| (format!("i{i}"), self.leaf())).collect::<Vec<_>>()
        };
        let (result, property) = (self.elementary(), self.elementary());
        let objects = Objects { inputs, result, property, instances: Vec::new() };
        self.line("INTERFACE it");
        self.method_head(&objects);
        self.line("END_METHOD");
        self.line(&format!("PROPERTY prop : {} GET END_GET SET END_SET END_PROPERTY", self.spell(&objects.property)));
        self.line("END_INTERFACE");
        self.line("INTERFACE other METHOD never : INT END_METHOD END_INTERFACE");
        let fields = self.object_block("oa", "IMPLEMENTS it", &[], &objects);
        self.object_block("ob", "EXTENDS oa", &fields, &objects);
        self.line("FUNCTION_BLOCK oc EXTENDS oa END_FUNCTION_BLOCK");
        self.objects = Some(objects);
    }

    fn method_head(&mut self, objects: &Objects) {
        self.line(&format!("METHOD act : {}", self.spell(&objects.result)));
        let inputs: Vec<Variable> = objects.inputs.iter().map(|(name, shape)| Variable::new(name.clone(), shape.clone())).collect();
        self.declare("VAR_INPUT", &inputs);
        self.scope.extend(inputs);
    }

    /// A block with the method and the property; what it inherits is in scope. Its own fields.
    fn object_block(&mut self, name: &str, head: &str, inherited: &[Variable], objects: &Objects) -> Vec<Variable> {
        self.line(&format!("FUNCTION_BLOCK {name} {head}"));
        self.open_scope();
        let fields: Vec<Variable> = (0..3).map(|i| Variable::new(format!("{name}{i}"), self.data(1))).collect();
        self.declare("VAR", &fields);
        let value = Variable::new(format!("{name}_value"), objects.property.clone());
        self.declare("VAR", std::slice::from_ref(&value));
        let own: Vec<Variable> = inherited.iter().chain(&fields).chain([&value]).cloned().collect();
        let derived = !inherited.is_empty();
        self.scope.extend(own.clone());
        self.declare_counters("VAR_TEMP");
        self.body_of_unit(&[], 3);
        self.act(&own, derived, objects);
        self.open_scope();
        let ty = self.spell(&objects.property);
        self.line(&format!("PROPERTY prop : {ty} GET prop := {}; END_GET SET {} := prop; END_SET END_PROPERTY", value.path, value.path));
        self.line("END_FUNCTION_BLOCK");
        own
    }

    /// The method, which may ask what it overrides.
    fn act(&mut self, own: &[Variable], derived: bool, objects: &Objects) {
        self.open_scope();
        self.method_head(objects);
        self.scope.extend(own.iter().cloned());
        self.elementaries("VAR", 3);
        self.declare_counters("VAR");
        self.scope.push(Variable::new("act", objects.result.clone()));
        let super_call = format!(
            "act := SUPER^.act({});",
            objects.inputs.iter().map(|(name, _)| format!("{name} := {name}")).collect::<Vec<_>>().join(", ")
        );
        let bound: Vec<String> = if derived { vec![super_call] } else { Vec::new() };
        self.body_of_unit(&bound, 5);
        let value = self.value(&objects.result, 2);
        if self.random.chance(50) {
            self.line(&format!("  act := {value};"));
        }
        self.line("END_METHOD");
    }

    /// Instances, pointers and interfaces of the main program.
    pub(super) fn object_variables(&mut self) {
        let Some(objects) = &mut self.objects else { return };
        objects.instances = ["oa0", "ob0", "obs[1]", "obs[2]", "oc0"].map(String::from).to_vec();
        self.line("VAR");
        self.line("  oa0 : oa; ob0 : ob; oc0 : oc; obs : ARRAY[1..2] OF ob;");
        self.line("  it0 : it; it1 : other; op : POINTER TO oa; on : POINTER TO oa; oy : REFERENCE TO oa; pc : POINTER TO ob;");
        self.line("END_VAR");
    }

    /// A statement on objects; an assignment where there are none.
    pub(super) fn object_statement(&mut self) -> bool {
        let Some(objects) = self.objects.clone().filter(|o| !o.instances.is_empty()) else { return false };
        let instance = objects.instances[self.random.below(objects.instances.len())].clone();
        match self.random.below(12) {
            0 | 1 => self.line(&format!("it0 := {instance};")),
            2 => self.line(&format!("op := ADR({instance});")),
            3 => self.line(&format!("oy REF= {instance};")),
            4 if self.wild => {
                let (far, near) = (self.random.below(3000), self.random.pick(&["op + 16", "ADR(oa0) + 32", "ADR(obs)"]));
                let wild = if self.random.chance(40) { format!("LWORD#{far}") } else { near.to_string() };
                self.line(&format!("op := {wild};"));
                match self.random.below(3) {
                    0 => self.line("on := op; __DELETE(on);"),
                    1 => self.method_on(&objects, "op^", "TRUE"),
                    _ => {}
                }
            }
            4 => self.line("IF on = 0 THEN on := __NEW(ob); END_IF"),
            5 => self.line("op := on := __NEW(oc);"),
            6 if self.wild => self.line("__DELETE(on);"),
            6 => self.line("IF on <> 0 THEN IF op = on THEN op := 0; END_IF it0 := 0; __DELETE(on); END_IF"),
            7 => self.query(),
            8 => self.property(&objects, &instance),
            _ => self.method_call(&objects, &instance),
        }
        true
    }

    fn query(&mut self) {
        let target = self.reach(&|s| s == &Shape::Scalar(named("BOOL")), true);
        let call = self.random.pick(&["__QUERYINTERFACE(it0, it1)", "__QUERYPOINTER(it0, pc)", "__ISVALIDREF(oy)", "it0 = oa0"]);
        let call = if call.starts_with("it0 =") { "it0 = 0" } else { call };
        match target {
            Some((path, _)) => self.line(&format!("{path} := {call};")),
            None => self.line(&format!("IF {call} THEN ; END_IF")),
        }
    }

    fn property(&mut self, objects: &Objects, instance: &str) {
        let shape = objects.property.clone();
        let value = self.value(&shape, 1);
        let target = self.reach(&|s| *s == shape, true);
        let path = self.random.pick(&["", "it0"]);
        let path = if path.is_empty() { instance } else { path };
        let guard = if path == "it0" && !self.wild { "IF it0 <> 0 THEN " } else { "IF TRUE THEN " };
        let read = target.map_or(String::new(), |(target, _)| format!(" {target} := {path}.prop;"));
        self.line(&format!("{guard}{path}.prop := {value};{read} END_IF"));
    }

    fn method_call(&mut self, objects: &Objects, instance: &str) {
        let (path, guard) = match self.random.below(5) {
            0 | 1 => ("it0", "it0 <> 0"),
            2 => ("op^", "op <> 0"),
            3 => ("oy", "__ISVALIDREF(oy)"),
            _ => (instance, "TRUE"),
        };
        let guard = if self.wild && self.random.chance(40) { "TRUE" } else { guard };
        self.method_on(objects, path, guard);
    }

    fn method_on(&mut self, objects: &Objects, path: &str, guard: &str) {
        let shape = objects.result.clone();
        let Some(arguments) = self.arguments(&objects.inputs, &[], 1, true) else { return };
        let target = self.reach(&|s| *s == shape, true);
        let call = format!("{path}.act({})", arguments.join(", "));
        let call = target.map_or_else(|| format!("{call};"), |(target, _)| format!("{target} := {call};"));
        self.line(&format!("IF {guard} THEN {call} END_IF"));
    }

    /// Statements whose faults are caught.
    pub(super) fn try_statement(&mut self, depth: usize) {
        self.line("__TRY");
        self.some(depth);
        self.line("__CATCH");
        self.some(0);
        if self.random.chance(40) {
            self.line("__FINALLY");
            self.some(0);
        }
        self.line("__ENDTRY");
    }
}
